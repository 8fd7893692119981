"""Laws of cross-sections: linear beams, inflated tubes; tables of their constants."""
