#include "completion.h"

#include <stdio.h>
#include <string.h>

#include "../common/message.h"
#include "help.h"

/*------------------------------------- words ----------------------------------------------------*/

static void print_commands(void) {
  const help_entry *entry;
  for (int i = 0; (entry = help_command_info(i)) != NULL; i++) printf("%s ", entry->name);
}

static void print_names_of_flags(command_id which) {
  const cli_flag *flag;
  const msim_option_entry *option;
  for (int i = 0; (flag = flag_info(i)) != NULL; i++)
    if (flag->commands & 1u << which) printf("--%s ", flag->name);
  for (int i = 0; (option = msim_option_info(i)) != NULL; i++)
    if (command_has_option(which, option)) printf("--%s ", option->name);
}

static void print_integrators(void) {
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++) printf("%s ", entry->name);
}

static void print_solvers(void) {
  msim_plugin_entry entry = {.size = sizeof entry};
  for (int32_t i = 0; msim_solver_info(i, NULL, &entry, NULL); i++) printf("%s ", entry.name);
}

/* The words among the values "exact | clamp" or "number > 0 | auto" */
static void print_choices(const char *values) {
  for (const char *bar; values; values = bar ? bar + 3 : NULL) {
    bar = strstr(values, " | ");
    const int length = (int)(bar ? (size_t)(bar - values) : strlen(values));
    if (!memchr(values, ' ', (size_t)length)) printf("%.*s ", length, values);
  }
}

static void print_values_of(const msim_option_entry *option) {
  if (strcmp(option->name, "integrator") == 0) print_integrators();
  else if (strcmp(option->name, "solver") == 0) print_solvers();
  else print_choices(option->values);
}

static int has_listed_values(const msim_option_entry *option) {
  return strcmp(option->values, "name") == 0 || strstr(option->values, " | ") != NULL;
}

/*------------------------------------- bash -----------------------------------------------------*/

/* `case` of the words after an option; anything else, as after --out, is completed as a file */
static void print_values(void) {
  const msim_option_entry *option;
  for (int i = 0; (option = msim_option_info(i)) != NULL; i++) {
    if (!has_listed_values(option)) continue;
    printf("    --%s) words='", option->name);
    print_values_of(option);
    puts("' ;;");
  }
}

static void print_flags_by_command(void) {
  for (int i = 0; i < NCOMMANDS; i++) {
    printf("      %s) words='", command_name((command_id)i));
    print_names_of_flags((command_id)i);
    puts("' ;;");
  }
}

static void print_function(void) {
  fputs(
      "_msim_cli_words() {\n"
      "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} words=\n"
      "  if ((COMP_CWORD == 1)); then words='",
      stdout);
  print_commands();
  puts(
      "'\n"
      "  else case $before in");
  print_values();
  fputs("    help) words='scene man ", stdout);
  print_commands();
  puts(
      "' ;;\n"
      "    completion) words='bash zsh' ;;\n"
      "    *) [[ $word != -* ]] || case ${COMP_WORDS[1]} in");
  print_flags_by_command();
  puts(
      "    esac ;;\n"
      "  esac; fi\n"
      "  COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))\n"
      "}");
}

static void print_bash(void) {
  puts("# Completion of msim_cli for bash; `msim_cli completion bash` prints it.");
  print_function();
  puts("complete -o default -F _msim_cli_words msim_cli");
}

/* The body of the function _msim_cli, which zsh loads from the file of that name. It runs functions
 * of bash. */
static void print_zsh(void) {
  puts(
      "#compdef msim_cli\n"
      "# Completion of msim_cli for zsh; `msim_cli completion zsh` prints it.\n"
      "autoload -U +X bashcompinit && bashcompinit");
  print_function();
  puts("_bash_complete -o default -F _msim_cli_words");
}

int completion_command(int argc, char **argv) {
  const char *shell = argc == 2 ? argv[1] : "";
  if (strcmp(shell, "bash") == 0) print_bash();
  else if (strcmp(shell, "zsh") == 0) print_zsh();
  else return report_usage_error("", "completion needs the name of a shell, bash or zsh");
  return EXIT_OK;
}
