"""What a direct solver may answer instead of factors."""


class Singular(ArithmeticError):
    """A matrix has no inverse."""
