"""What a recording's own numbers say, whatever its name or its sheet claim."""
