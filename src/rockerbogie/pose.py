"""A settled pose, or a million of them: what was solved for, and what follows from it when asked."""

from __future__ import annotations
