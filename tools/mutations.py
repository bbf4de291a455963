"""The operators of tools/mutate: small faults in C code, each as a place in a file and a new text."""
import re
from collections import namedtuple

Mutation = namedtuple("Mutation", "operator path start end after")

NO_CODE = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|'
                     r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.S | re.M)
ASSIGNMENT_OR_CALL = re.compile(r"(\(void\)|[*(]*\w+(->|\.|\[[^;]*?\]|\w|\))*( [-+*/|&^]?= |\(|"
                                r"\+\+$|--$))", re.S)
CONTROL = re.compile(r"\s*(else\b|do\b|(?:if|for|while) (?=\())")


def closing(text, at):
    """The place behind the parenthesis that closes the one at `at`."""
    depth = 0
    for i in range(at, len(text)):
        depth += (text[i] == "(") - (text[i] == ")")
        if depth == 0:
            return i + 1
    return len(text)


def statements(code):
    """(start, end) of each expression statement inside functions, without its semicolon."""
    start = braces = parentheses = 0
    for i, c in enumerate(code):
        parentheses += (c == "(") - (c == ")")
        braces += (c == "{") - (c == "}")
        if parentheses or c not in ";{}":
            continue
        if c == ";" and braces:
            while head := CONTROL.match(code, start, i):
                start = head.end() if code[head.end()] != "(" else closing(code, head.end())
            start += len(code[start:i]) - len(code[start:i].lstrip())
            if ASSIGNMENT_OR_CALL.match(code[start:i]) and not code.startswith("return", start):
                yield start, i
        start = i + 1


def swaps(pairs):
    """An operator that puts one text for another; the texts of a pair are put for each other."""
    other = {a: b for pair in pairs for a, b in (pair, pair[::-1])}
    pattern = re.compile("|".join(re.escape(text) for text in sorted(other, key=len)[::-1]))
    return lambda code: ((m.start(), m.end(), other[m.group()]) for m in pattern.finditer(code))


def constants(code):
    for m in re.finditer(r"(?<![\w.\[])\d+(\.\d*)?(e[-+]?\d+)?(?![\w.])", code):
        text = m.group()
        is_integer = text.isdigit()
        yield m.start(), m.end(), str(int(text) + 1) if is_integer else f"2 * {text}"


def indices(code):
    for m in re.finditer(r"(?<=[\w\])])\[([01]|[a-z]\w*)\]", code):
        inner = {"0": "1", "1": "0"}.get(m.group(1), m.group(1) + " + 1")
        yield m.start(), m.end(), f"[{inner}]"


def negations(code):
    for m in re.finditer(r"\bif \(", code):
        end = closing(code, m.end() - 1)
        yield m.end() - 1, end, f"(!{code[m.end() - 1:end]})"


def synchronizations(code):
    for m in re.finditer(r"(?<=[\s(!=])\w*(?:sync|flush|Flush)\w*(?=\()", code):
        yield m.start(), closing(code, m.end()), "0"


OPERATORS = {
    "sign": swaps([(" + ", " - "), (" * ", " / "), (" += ", " -= ")]),
    "constant": constants,
    "boundary": swaps([(" < ", " <= "), (" > ", " >= ")]),
    "dropped": lambda code: ((start, end, "") for start, end in statements(code)),
    "sync": synchronizations,
    "index": indices,
    "negated": lambda code: (*negations(code), *swaps([(" == ", " != ")])(code)),
    "logic": swaps([(" && ", " || ")]),
}


def mutations_of(path, operator):
    """All mutations of a file by one operator; none in comments, strings and directives."""
    code = NO_CODE.sub(lambda m: re.sub(r"[^\n]", "_", m.group()), path.read_text())
    return [Mutation(operator, path, *found) for found in OPERATORS[operator](code)]


def describe(m):
    """(line, its text before, its text after), each on one line."""
    text = m.path.read_text()
    first, last = text.rfind("\n", 0, m.start) + 1, text.find("\n", m.end)
    before = text[first:last]
    after = before[:m.start - first] + m.after + before[m.end - first:]
    return text.count("\n", 0, m.start) + 1, *(" ".join(t.split()) for t in (before, after))


def accepted_mutations(path):
    """{(file, before, after)} from blocks `FILE: reason`, `- before`, `+ after`."""
    found = set()
    file = before = None
    for line in path.read_text().splitlines() if path.is_file() else ():
        if line.startswith("- "):
            before = line[2:]
        elif line.startswith("+ "):
            found.add((file, before, line[2:]))
        elif line and line[0] not in "# ":
            file = line.split(":")[0]
    return found
