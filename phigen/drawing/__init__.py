"""Parts of figures: each module draws one kind of panel on a given figure."""
