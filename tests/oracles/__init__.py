"""Independent oracles: closed forms, simple schemes and interpreters, which share no code with what
they judge."""
