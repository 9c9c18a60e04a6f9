"""Terms spelled as mathematics: LaTeX, MathML, SymPy."""
