"""Studies: figures and reports, each from one command."""
