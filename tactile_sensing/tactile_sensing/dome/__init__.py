"""Forward models of a round probe: an array of tactels in a skin on a rigid sphere."""
