"""Laws of `friction` and of `contact`: frozen records whose methods are expressions."""
