"""Hidden Markov map matching in three parts: emission, transition, and a search that knows no roads."""
