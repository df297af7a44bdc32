"""How names are found: entry points, files of users, former names."""
