#include "scene/json_syntax.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

/* The bytes of a token of JSON: a string, a bracket, ',' or ':', or what stands between these */
typedef struct token {
  size_t from, to;
} token;

static int is_one_of(char c, const char *characters) { return c && strchr(characters, c) != NULL; }

static size_t string_end(const char *text, size_t length, size_t at) {
  for (at++; at < length && text[at] != '"'; at++)
    if (text[at] == '\\') at++;
  return at < length ? at + 1 : length;
}

/* The first token from `at` on; an empty one at the end */
static token next_token(const char *text, size_t length, size_t at) {
  while (at < length && is_one_of(text[at], " \t\r\n")) at++;
  token t = {at, at};
  if (at == length) return t;
  if (text[at] == '"') t.to = string_end(text, length, at);
  else if (is_one_of(text[at], "{}[],:")) t.to++;
  else
    while (t.to < length && !is_one_of(text[t.to], " \t\r\n{}[],:\"")) t.to++;
  return t;
}

/* The token that ends at `position` or contains it, and the two before it */
static void find_tokens(const char *text, size_t length, size_t position, token last[3]) {
  memset(last, 0, 3 * sizeof *last);
  do {
    last[2] = last[1];
    last[1] = last[0];
    last[0] = next_token(text, length, last[1].to);
  } while (last[0].to < position && last[0].to > last[0].from);
}

/* "line 2, column 18": of the character at a byte, both from 1 */
typedef struct place {
  char text[64];
} place;
static place describe_place(const char *text, size_t at) {
  place p;
  size_t line = 1, column = 1;
  for (size_t i = 0; i < at; i++) {
    const int starts = ((unsigned char)text[i] & 0xC0) != 0x80; /* a character of UTF-8 */
    column += (size_t)starts;
    if (text[i] == '\n') line++, column = 1;
  }
  snprintf(p.text, sizeof p.text, "line %zu, column %zu", line, column);
  return p;
}

/* 1: "0,5", a number, a comma and a number without blanks */
static int is_decimal_comma(const char *text, const token last[3]) {
  return text[last[1].from] == ',' && last[2].to == last[1].from && last[1].to == last[0].from &&
         isdigit((unsigned char)text[last[2].to - 1]) && isdigit((unsigned char)text[last[0].from]);
}

/* What other languages allow and JSON does not: the beginning of a token, and what JSON has */
static const struct {
  const char *begin, *remedy;
} foreign[] = {{"'", "keys and texts are written in double quotes"},
               {"\xE2\x80\x9C", "keys and texts are written in straight double quotes"},
               {"\xE2\x80\x9D", "keys and texts are written in straight double quotes"},
               {"//", "JSON has no comments"},
               {"/*", "JSON has no comments"},
               {"#", "JSON has no comments"},
               {"True", "JSON writes true"},
               {"False", "JSON writes false"},
               {"NaN", "numbers must be finite"},
               {"Infinity", "numbers must be finite"},
               {"-Infinity", "numbers must be finite"}};

static int begins_with(const char *text, token t, const char *beginning) {
  const size_t n = strlen(beginning);
  return t.to - t.from >= n && memcmp(text + t.from, beginning, n) == 0;
}

/* NULL: there is none. */
static const char *find_remedy_of_token(const char *text, const char *error, const token last[3]) {
  const char found = text[last[0].from];
  if (strncmp(error, "':'", 3) == 0) return "a colon stands between a key and its value";
  for (size_t i = 0; i < sizeof foreign / sizeof *foreign; i++)
    if (begins_with(text, last[0], foreign[i].begin)) return foreign[i].remedy;
  if (found == '"' && strstr(error, "newline")) return "is the closing quote missing?";
  if (isalpha((unsigned char)found) && strncmp(error, "string", 6) == 0)
    return "keys are written in double quotes";
  if (is_one_of(found, "+-.0123456789") && is_one_of(text[last[1].from], ":,[") &&
      strncmp(error, "string", 6) != 0)
    return "numbers are written like 0.5, -2 or 1e-3";
  return NULL;
}

/* Of numbers that JSON permits, and that are out of range here; NULL: the error is another one. */
static const char *find_remedy_of_range(const char *error) {
  if (strncmp(error, "real number overflow", 20) == 0) return "numbers must be finite";
  return strncmp(error, "too big", 7) == 0 ? "write so large a number with an exponent, like 1e20"
                                           : NULL;
}

/* What is wrong with the whole file; NULL: nothing is known. */
static const char *find_remedy_of_file(const char *text, size_t length, const char *error) {
  if (length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0)
    return "save the file as UTF-8 without a byte order mark";
  if (strstr(error, "unable to decode")) return "save the file as UTF-8";
  return strncmp(error, "'[' or '{'", 10) == 0 ? "a scene is a JSON object and begins with {"
                                               : NULL;
}

/* A hint for an error at the token last[0]; "" if there is none */
static void find_remedy(const char *text, size_t length, const json_error_t *error,
                        const token last[3], size_t size, char *hint) {
  const char *remedy = find_remedy_of_range(error->text);
  if (!remedy) remedy = find_remedy_of_file(text, length, error->text);
  snprintf(hint, size, "%s%s", remedy ? "; " : "", remedy ? remedy : "");
  if (remedy || last[0].to == last[0].from || last[1].to == 0) return;
  const char found = text[last[0].from];
  remedy = find_remedy_of_token(text, error->text, last);
  if (last[2].to > 0 && is_decimal_comma(text, last))
    snprintf(hint, size, "; decimals are written with a point, %.*s.%.*s",
             (int)(last[2].to - last[2].from > 20 ? 20 : last[2].to - last[2].from),
             text + last[2].from,
             (int)(last[0].to - last[0].from > 20 ? 20 : last[0].to - last[0].from),
             text + last[0].from);
  else if (text[last[1].from] == ',' && is_one_of(found, "}]"))
    snprintf(hint, size, "; remove the comma before it, at %s",
             describe_place(text, last[1].from).text);
  else if (is_one_of(*error->text, "'") && error->text[1] != ':' &&
           strstr(error->text, "expected") && !is_one_of(text[last[1].from], ",:{[") &&
           !is_one_of(found, "}],:#/'"))
    snprintf(hint, size, "; is a comma missing at %s, where the value before it ends?",
             describe_place(text, last[1].to).text);
  else if (remedy) snprintf(hint, size, "; %s", remedy);
}

msim_status ms_json_syntax_refuse(const ms_json_reader *r, const char *text, size_t length,
                                  const json_error_t *error) {
  char label[600], hint[160];
  token last[3];
  find_tokens(text, length, (size_t)error->position, last);
  find_remedy(text, length, error, last, sizeof hint, hint);
  snprintf(label, sizeof label, "%s:%d:%d", r->label, error->line, error->column);
  const ms_json_reader there = {.label = label, .err = r->err};
  return ms_json_fail(&there, MSIM_ERR_ARG, "%s%s", error->text, hint);
}
