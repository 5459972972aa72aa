"""Which setting of a spec reaches an accuracy cheapest: candidates built, measured, compared and confirmed."""
