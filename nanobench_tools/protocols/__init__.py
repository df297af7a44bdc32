"""What each task gives to a method and how it scores it."""
