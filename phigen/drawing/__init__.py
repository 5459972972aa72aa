"""Parts of figures: each module draws one kind of panel on a figure that it is given."""
