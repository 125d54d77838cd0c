"""Parameter studies: scenes that differ in a few keys, shared out by dask among workers."""
