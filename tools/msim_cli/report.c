#include "report.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "../common/files.h"
#include "../common/message.h"
#include "stats.h"

enum { VALUE_COLUMN = 16 };

/*------------------------------------- the end of a run -----------------------------------------*/

static void print_method(const msim_plan *plan, const msim_stats *stats) {
  int direct = strcmp(plan->solver, "none") == 0;
  print_column(VALUE_COLUMN, "method");
  printf("%s, %s%s\n", plan->integrator, direct ? "no linear solver needed" : "linear solver ",
         direct ? "" : plan->solver);
  print_column(VALUE_COLUMN, "steps");
  if (plan->tol > 0)
    printf("%" PRId64 ", accepted with tol = %g; %" PRId64 " more were rejected", stats->steps,
           plan->tol, stats->rejected_steps);
  else printf("%" PRId64 " of h = %g s", stats->steps, plan->h);
  if (stats->steps < plan->steps) printf("; %" PRId64 " were planned", plan->steps);
  putchar('\n');
}

static void print_time(const report *r, const msim_state *state) {
  int64_t steps = state->step - r->first.step;
  print_column(VALUE_COLUMN, "simulated");
  printf("from t = %g s to t = %g s\n", r->first.t, state->t);
  print_column(VALUE_COLUMN, "took");
  printf("%.3g s", r->wall_s);
  double speed = r->wall_s > 0 ? (double)steps / r->wall_s : 0;
  if (speed > 0) printf(speed < 100 ? ", %.3g steps per second" : ", %.0f steps per second", speed);
  putchar('\n');
}

static void print_energy_row(const char *name, double start, double end) {
  print_column(VALUE_COLUMN, name);
  printf("%14.7g %14.7g %14.3g\n", start, end, end - start);
}

static void print_energies(const msim_energy *start, const msim_energy *end) {
  putchar('\n');
  print_column(VALUE_COLUMN, "energy, J");
  printf("%14s %14s %14s\n", "at the start", "at the end", "change");
  print_energy_row("kinetic", start->kinetic, end->kinetic);
  print_energy_row("elastic", start->elastic, end->elastic);
  print_energy_row("gravitational", start->gravitational, end->gravitational);
  print_energy_row("total", start->total, end->total);
  if (end->work != start->work) print_energy_row("work", start->work, end->work);
  putchar('\n');
}

static void print_events(const report *r, const msim_stats *stats) {
  if (stats->contacts) {
    print_column(VALUE_COLUMN, "contacts");
    printf("%" PRId64 " impacts or reflections of particles%s\n", stats->contacts,
           r->self_contact ? ", and pairs pushed apart" : "");
  }
  if (stats->indefinite_steps) {
    print_column(VALUE_COLUMN, "indefinite");
    printf("%" PRId64 " steps whose exact matrix was not positive definite\n",
           stats->indefinite_steps);
  }
  if (stats->incomplete_steps) {
    print_column(VALUE_COLUMN, "incomplete");
    printf("%" PRId64 " steps made although iterations ended at their maximum\n",
           stats->incomplete_steps);
  }
  if (r->notes) {
    print_column(VALUE_COLUMN, "notes");
    printf("%d, printed to standard error\n", r->notes);
  }
}

static void print_out(const report *r, const char *path) {
  print_column(VALUE_COLUMN, "motion");
  printf("%s; frames: %" PRId64 "%s\n", path, r->frames, r->goes_on ? " more" : "");
  const char *hint = has_extension(path, ".vtkhdf")
                         ? "to view it: open it in ParaView 5.12 or later, press Apply, then Play"
                     : has_extension(path, ".pvd")
                         ? "to view it: open it in ParaView, press Apply, then Play"
                     : has_extension(path, ".html") ? "to view it: open it in a browser"
                     : has_extension(path, ".csv")  ? "a text file for spreadsheets and scripts"
                                                    : NULL;
  if (!hint) return;
  print_column(VALUE_COLUMN, "");
  puts(hint);
}

static void print_files(const report *r, const arguments *args) {
  if (args->out) print_out(r, args->out);
  if (args->final) {
    print_column(VALUE_COLUMN, "last state");
    puts(args->final);
  }
  int ntables = 0;
  for (int i = 0; i < NTABLES; i++) {
    if (!args->tables[i]) continue;
    print_column(VALUE_COLUMN, table_name((table_kind)i));
    puts(args->tables[i]);
    ntables++;
  }
  if (!args->out && !args->final && !ntables) {
    print_column(VALUE_COLUMN, "kept");
    puts("nothing; use --out FILE for the motion, --final FILE.json for the last state");
  }
}

static void print_name(const report *r, const arguments *args) {
  char text[256];
  snprintf(text, sizeof text, "%s", *r->name ? r->name : args->scene);
  clean_text(text);
  puts(text);
}

void report_run(const report *r, const arguments *args, msim_sim *sim) {
  msim_plan plan = {.size = sizeof plan};
  msim_stats stats = {.size = sizeof stats};
  msim_state state = {.size = MSIM_STATE_TIME};
  msim_energy end = {.size = sizeof end};
  msim_sim_plan(sim, &plan);
  msim_sim_stats(sim, &stats);
  msim_sim_state(sim, &state);
  msim_sim_energy(sim, &end);
  print_name(r, args);
  print_method(&plan, &stats);
  print_time(r, &state);
  print_energies(&r->start, &end);
  print_events(r, &stats);
  print_files(r, args);
  if (args->stats) stats_print(&stats);
}

/*------------------------------------- list -----------------------------------------------------*/

static size_t name_width(void) {
  const msim_integrator_entry *entry;
  size_t longest = 0;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++)
    if (strlen(entry->name) > longest) longest = strlen(entry->name);
  return longest;
}

static void list_integrators(void) {
  const msim_integrator_entry *entry;
  int width = (int)name_width();
  int column = printf("  %-*s  order  kind      ", width, "name");
  puts("method");
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++) {
    if (entry->order == 0) printf("  %-*s  %-5s  %-8s  ", width, entry->name, "-", "-");
    else
      printf("  %-*s  %-5d  %-8s  ", width, entry->name, (int)entry->order,
             entry->implicit ? "implicit" : "explicit");
    print_wrapped((size_t)column, entry->doc);
  }
}

typedef int32_t plugin_info(int32_t i, const char *path, msim_plugin_entry *entry, msim_error *err);

static void list_plugin(int width, const msim_plugin_entry *entry) {
  char text[512];
  int column = printf("  %-*s  %-9s  ", width, entry->name, entry->available ? "yes" : "no");
  int licensed = entry->license && *entry->license;
  snprintf(text, sizeof text, "%s%s%s", entry->library ? entry->library : "",
           licensed ? ", licence " : "", licensed ? entry->license : "");
  if (*text) print_wrapped((size_t)column, text);
  if (!entry->note || !*entry->note) return;
  if (*text) printf("%*s", column, "");
  print_wrapped((size_t)column, entry->note);
}

static void list_plugins(plugin_info *info, const char *path) {
  msim_plugin_entry entry = {.size = sizeof entry};
  msim_error err;
  int width = 0;
  for (int32_t i = 0; info(i, path, &entry, &err); i++)
    if ((int)strlen(entry.name) > width) width = (int)strlen(entry.name);
  printf("  %-*s  available  library\n", width, "name");
  for (int32_t i = 0; info(i, path, &entry, &err); i++) list_plugin(width, &entry);
}

int report_list(const arguments *args) {
  puts("Integrators");
  list_integrators();
  puts("\nLinear solvers");
  list_plugins(msim_solver_info, args->options.plugin_path);
  puts(
      "\n"
      "Recorders, chosen by the extension of the --out file");
  list_plugins(msim_recorder_info, args->options.plugin_path);
  puts(
      "\n"
      "Importers, chosen by the extension of the scene file, *.h5");
  list_plugins(msim_importer_info, NULL); /* scenes are read before there are options */
  puts(
      "\n"
      "Communicators, chosen by the environment of mpirun");
  list_plugins(msim_comm_info, args->options.plugin_path);
  return EXIT_OK;
}
