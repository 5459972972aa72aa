"""Search for the cheapest setting of a spec for an accuracy: candidates are built, measured, compared and confirmed."""
