"""How a test says what is wrong."""


class Failure(Exception):
    """Something is not as it has to be; the text says what was found and what was wanted."""


def expect(what, found, wanted):
    if found != wanted:
        raise Failure(f"{what}: found {found!r}, wanted {wanted!r}")


def expect_in(what, part, text):
    if part not in text:
        raise Failure(f"{what}: no {part!r} in {text.strip()!r}")


def expect_true(what, found):
    if not found:
        raise Failure(what)


def whole(function):
    """Marks a test that runs only with `--all` or by name. The others cover each client once."""
    function.whole = True
    return function


def limit(seconds):
    """Gives a test another time limit than 90 s."""

    def mark(function):
        function.limit_s = seconds
        return function

    return mark
