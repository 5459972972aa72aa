"""Search for the method and step that reach an accuracy at the least cost, by building and measuring candidates."""
