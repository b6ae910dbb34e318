"""Long-term behaviour: equilibria, cycles, gaits, their stability and their continuation in
parameters."""
