"""Forces on a rover in slow motion: contact forces, required friction, tip margins."""
