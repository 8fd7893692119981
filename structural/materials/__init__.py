"""Laws of cross-sections and fabrics: linear beams, inflated tubes, membranes; tables of their constants."""
