"""A clock error that moves within the flight: found from the recording itself, and taken out."""
