"""Independent oracles: closed forms and simple schemes that know nothing of the package under
test."""
