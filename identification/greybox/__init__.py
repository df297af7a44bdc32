"""Grey-box identification: models of physical terms fitted to flights by what they predict."""
