"""Static balance of the mechanism: contact forces, least friction, hold margins."""
