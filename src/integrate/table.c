#include <string.h>

#include "integrate/methods.h"

#define ADDRESS(table) &table,
static const ms_integrator *const methods[] = {MS_INTEGRATORS(ADDRESS)};
#undef ADDRESS
enum { NMETHODS = sizeof methods / sizeof *methods };

/* Names that scenes may use once a later version brings the methods. */
#define LATER(name) \
  { name, "not part of this version yet", 0, 0 }
static const msim_integrator_entry later[] = {LATER("auto")};
#undef LATER
enum { NLATER = sizeof later / sizeof *later };

const ms_integrator *ms_integrator_at(int32_t i) {
  return i >= 0 && i < NMETHODS ? methods[i] : NULL;
}

const msim_integrator_entry *msim_integrator_info(int32_t i) {
  if (i < 0 || i >= NMETHODS + NLATER) return NULL;
  return i < NMETHODS ? &methods[i]->entry : &later[i - NMETHODS];
}

static const char *name_at(int32_t i, const void *data) {
  (void)data;
  const msim_integrator_entry *entry = msim_integrator_info(i);
  return entry ? entry->name : NULL;
}

msim_status ms_integrator_find(const char *name, const ms_integrator **integrator,
                               msim_error *err) {
  for (int i = 0; i < NMETHODS; i++) {
    *integrator = methods[i];
    if (strcmp(name, methods[i]->entry.name) == 0) return MSIM_OK;
  }
  *integrator = NULL;
  for (int i = 0; i < NLATER; i++)
    if (strcmp(name, later[i].name) == 0)
      return ms_fail(err, MSIM_ERR_UNSUPPORTED,
                     "integrator '%s' is known, but not part of msim %s yet", name, msim_version());
  return ms_fail(err, MSIM_ERR_NAME, "there is no integrator '%s'%s", name,
                 ms_did_you_mean(name, name_at, NULL).text);
}
