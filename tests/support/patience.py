"""Time that tests wait for an event."""

from __future__ import annotations

#: Time within which something must happen, s. Kernels may have to be compiled first, beside other tests on a busy machine. It
#: bounds a test that has failed; no test checks that anything is fast.
PATIENCE = 600.0
