#include "manual.h"

#include <stdio.h>
#include <string.h>

#include "../common/message.h"
#include "help.h"
#include "scene_help.h"

/* Text of roff: no hyphens from minus signs, and no requests from lines that begin with a dot. */
static void print_text(const char *text) {
  if (*text == '.' || *text == '\'') fputs("\\&", stdout);
  for (; *text; text++) {
    if (*text == '\\') fputs("\\e", stdout);
    else if (*text == '-') fputs("\\-", stdout);
    else putchar(*text);
  }
}

static void print_line(const char *text) {
  print_text(text);
  putchar('\n');
}

static void print_section(const char *name) { printf(".SH %s\n", name); }

/* A tagged paragraph: "--h VALUE" and its description */
static void print_tag(const char *dashes, const char *name, const char *value) {
  puts(".TP");
  fputs("\\fB", stdout);
  print_text(dashes);
  print_text(name);
  fputs("\\fR", stdout);
  if (*value) fputs(" \\fI", stdout), print_text(value), fputs("\\fR", stdout);
  putchar('\n');
}

static void print_entries(const help_entry *(*info)(int i)) {
  const help_entry *entry;
  for (int i = 0; (entry = info(i)) != NULL; i++) {
    print_tag("", entry->name, entry->operands);
    print_line(entry->doc);
  }
}

static void print_flags(void) {
  const cli_flag *flag;
  for (int i = 0; (flag = flag_info(i)) != NULL; i++) {
    print_tag("--", flag->name, flag->value ? flag->value : "");
    print_line(flag->doc);
  }
}

static void print_options(void) {
  const msim_option_entry *option;
  for (int i = 0; (option = msim_option_info(i)) != NULL; i++) {
    print_tag("--", option->name, option->values);
    print_text(option->doc);
    if (*option->preset) fputs("; default ", stdout), print_text(option->preset);
    putchar('\n');
  }
}

static int print_key(const scene_key *key, void *user) {
  char text[1024];
  (void)user;
  if (strncmp(key->path, "run.", 4) == 0) return EXIT_OK; /* the options above */
  print_tag("", key->path, "");
  scene_help_describe(key, text, sizeof text);
  print_line(text);
  puts(".br");
  snprintf(text, sizeof text, "\"%s\": %s", key->name, key->example);
  print_line(text);
  return EXIT_OK;
}

static void print_start(void) {
  printf(".TH MSIM_CLI 1 \"\" \"msim %s\" \"User Commands\"\n", msim_version());
  print_section("NAME");
  puts("msim_cli \\- simulate mass\\-spring systems");
  print_section("SYNOPSIS");
  puts(
      ".B msim_cli run\n.I SCENE\n[\\fB\\-\\-\\fIOPTION VALUE\\fR]...\n.br\n"
      ".B msim_cli explain\n.I SCENE\n[\\fB\\-\\-\\fIOPTION VALUE\\fR]...\n.br\n"
      ".B msim_cli list\n.br\n"
      ".B msim_cli help\n[\\fITOPIC\\fR]");
  print_section("DESCRIPTION");
  puts(
      "Simulates particles, springs, dampers and planes that a scene file describes, with "
      "explicit\n"
      "and implicit methods, and writes the motion or the last state.");
}

static void print_end(void) {
  print_section("ENVIRONMENT");
  print_entries(help_environment_info);
  print_section("EXIT STATUS");
  puts(
      ".TP\n0\nsuccess\n.TP\n1\nerror\n.TP\n2\n"
      "a numerical event or Ctrl\\-C ended the run early, and all results up to then are kept");
  print_section("EXAMPLE");
  puts(".nf");
  for (const char *line = help_example; *line;) {
    char text[128];
    const int length = (int)strcspn(line, "\n");
    snprintf(text, sizeof text, "%.*s", length, line);
    print_line(text);
    line += length + (line[length] == '\n');
  }
  puts(".fi");
}

int manual_print(void) {
  print_start();
  print_section("COMMANDS");
  print_entries(help_command_info);
  print_section("FLAGS");
  puts("Of \\fBrun\\fR:");
  print_flags();
  print_section("OPTIONS");
  puts("Each may also be given in the scene's \\fBrun\\fR; the command line wins.");
  print_options();
  print_section("SCENE FILES");
  puts(
      "A scene file is JSON, or HDF5 (*.h5) with the same tree. Units are SI, indices count from\n"
      "0.");
  const int status = scene_help_visit(print_key, NULL);
  print_end();
  return status;
}
