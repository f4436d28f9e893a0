"""Choice between compiled kernels and the same functions in plain Python."""

from __future__ import annotations

import numba

#: Second copy of the package `_kernels`, in plain Python (`uncompiled`).
PLAIN_PACKAGE = "rockerbogie._plain_kernels"
#: False in plain Python: in that copy, and if NUMBA_DISABLE_JIT is set.
COMPILED = not (numba.config.DISABLE_JIT or __name__.startswith(PLAIN_PACKAGE))
