"""The limits of displays: their gamuts, and what is shown of colours and luminances outside them."""
