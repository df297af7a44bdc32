"""A campaign: flights of alternated controllers, repeated, in pairs of equal battery voltage."""
