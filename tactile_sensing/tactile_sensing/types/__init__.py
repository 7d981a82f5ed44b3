"""Plain data: tactel array, tactile image, contact."""
