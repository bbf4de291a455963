"""A checker for the keywords of JSON schemas (draft 2020-12) that the schema of scene files uses.
Any other keyword is an error, so that none is silently ignored."""

ANNOTATIONS = {"$schema", "title", "description", "default", "examples", "unit", "values"}
KNOWN = ANNOTATIONS | {"type", "const", "enum", "anyOf", "oneOf", "minimum", "exclusiveMinimum",
                       "maximum", "items", "minItems", "maxItems", "minLength", "properties",
                       "required", "additionalProperties"}


def is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def has_type(value, name):
    return {"object": isinstance(value, dict), "array": isinstance(value, list),
            "string": isinstance(value, str), "boolean": isinstance(value, bool),
            "number": is_number(value),
            "integer": is_number(value) and float(value).is_integer()}[name]


def equal(a, b):
    return a == b and isinstance(a, bool) == isinstance(b, bool)


def number_is_valid(schema, value):
    return (value >= schema.get("minimum", value) and value <= schema.get("maximum", value)
            and ("exclusiveMinimum" not in schema or value > schema["exclusiveMinimum"]))


def array_is_valid(schema, value):
    return (schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value))
            and all(is_valid(schema.get("items", {}), item) for item in value))


def object_is_valid(schema, value):
    members = schema.get("properties", {})
    if not schema.get("additionalProperties", True) and set(value) - set(members):
        return False
    return (set(schema.get("required", ())) <= set(value)
            and all(is_valid(members.get(key, {}), item) for key, item in value.items()))


def is_valid(schema, value):
    """Whether the value meets the schema."""
    if set(schema) - KNOWN:
        raise ValueError(f"unknown keywords {set(schema) - KNOWN}")
    return ((("type" not in schema) or has_type(value, schema["type"]))
            and ("const" not in schema or equal(value, schema["const"]))
            and ("enum" not in schema or any(equal(value, each) for each in schema["enum"]))
            and ("anyOf" not in schema or any(is_valid(each, value) for each in schema["anyOf"]))
            and ("oneOf" not in schema
                 or sum(is_valid(each, value) for each in schema["oneOf"]) == 1)
            and (not is_number(value) or number_is_valid(schema, value))
            and (not isinstance(value, str) or len(value) >= schema.get("minLength", 0))
            and (not isinstance(value, list) or array_is_valid(schema, value))
            and (not isinstance(value, dict) or object_is_valid(schema, value)))
