"""Search for the cheapest setting of a spec at an accuracy: candidates are built, measured, compared and confirmed."""
