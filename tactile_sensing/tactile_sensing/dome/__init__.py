"""Forward models of a round probe: a skin on a rigid sphere, an array of tactels within it."""
