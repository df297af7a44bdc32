"""What the verbs and the Python functions are made of: options, loading, running and scoring, tables and results."""
