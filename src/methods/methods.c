#include "methods/methods.h"

#include <string.h>

#include "base/suggest.h"

#define ADDRESS(table) &table,
static const ms_integrator *const methods[] = {MS_INTEGRATORS(ADDRESS)};
#undef ADDRESS
enum { NMETHODS = sizeof methods / sizeof *methods };

/* Not a method: a sim chooses one of the others for it. */
static const msim_integrator_entry auto_entry = {
    MS_AUTO,
    "chooses the least expensive of these methods that attains tol in the scene; `explain` prints "
    "the choice and the reasons",
    0, 0};

const ms_integrator *ms_methods_at(int32_t i) { return i >= 0 && i < NMETHODS ? methods[i] : NULL; }

const msim_integrator_entry *msim_integrator_info(int32_t i) {
  if (i == NMETHODS) return &auto_entry;
  return i >= 0 && i < NMETHODS ? &methods[i]->entry : NULL;
}

static const char *name_at(int32_t i, const void *data) {
  (void)data;
  const msim_integrator_entry *entry = msim_integrator_info(i);
  return entry ? entry->name : NULL;
}

msim_status ms_methods_find(const char *name, const ms_integrator **integrator, msim_error *err) {
  for (int i = 0; i < NMETHODS; i++) {
    *integrator = methods[i];
    if (strcmp(name, methods[i]->entry.name) == 0) return MSIM_OK;
  }
  *integrator = NULL;
  return ms_error_set(err, MSIM_ERR_NAME,
                      "unknown integrator '%s'%s; `msim_cli list` shows all of them", name,
                      ms_suggest_hint(name, name_at, NULL).text);
}
