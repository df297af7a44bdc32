"""A flight of a Crazyflie: checklist, take-off, the streamed path, landing, and the rules that end it."""
