#include "targets.h"

#include "../common/files.h"
#include "../common/message.h"
#include "final.h"
#include "statics.h"
#include "tables.h"

typedef struct target {
  const char *flag, *path;      /* path: NULL if it is not given */
  const char *beginning, *what; /* of such files of msim; NULL: the recorder knows them */
  int may_be_init;              /* it is written when --init has been read */
} target;

/* Files of others are replaced with --force only. */
static int check_owner(const target *file) {
  if (!file->beginning || !file_is_foreign(file->path, file->beginning)) return EXIT_OK;
  return report_error("%s exists and is not %s of msim; use another name, or --force to replace it",
                      file->path, file->what);
}

/* Files are renamed when they are written, which would replace a device or a pipe. */
static int check_target(const arguments *args, const target *file) {
  const char *kind = special_file_kind(file->path), *command = command_name(args->which);
  if (same_file(file->path, args->scene))
    return report_usage_error(
        command, "'%s' is the scene file and must not be overwritten; use another name",
        args->scene);
  if (!file->may_be_init && same_file(file->path, args->init))
    return report_usage_error(command, "'%s' cannot be both --init and %s; use another name",
                              file->path, file->flag);
  if (kind)
    return report_usage_error(command, "%s '%s' is %s, not a file", file->flag, file->path, kind);
  return args->force ? EXIT_OK : check_owner(file);
}

int check_targets(const arguments *args) {
  const target all[] = {
      {"--out", args->out, NULL, NULL, 0},
      {"--final", args->final, final_beginning, "a final state", 1},
      {"--json", args->json, modes_beginning, "a file of frequencies", 0},
      {"--energies", args->tables[TABLE_ENERGIES], table_title(TABLE_ENERGIES),
       "a table of energies", 0},
      {"--reactions", args->tables[TABLE_REACTIONS], table_title(TABLE_REACTIONS),
       "a table of reactions", 0},
      {"--springs", args->tables[TABLE_SPRINGS], table_title(TABLE_SPRINGS), "a table of springs",
       0},
  };
  enum { COUNT = sizeof all / sizeof *all };
  for (int i = 0; i < COUNT; i++) {
    if (!all[i].path) continue;
    for (int j = 0; j < i; j++)
      if (same_file(all[j].path, all[i].path))
        return report_usage_error(command_name(args->which),
                                  "'%s' cannot be both %s and %s; use another name", all[i].path,
                                  all[j].flag, all[i].flag);
    if (check_target(args, &all[i])) return EXIT_ERROR;
  }
  return EXIT_OK;
}
