"""How far the pad goes after a stop."""
