"""Controllers that servo laws share."""
