"""The C target: C99 and libm only, no heap, no writable globals, reentrant."""
