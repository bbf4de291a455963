/* break - break springs of a running sim by hand */
#include "sim/breaking.h"
#include "sim/rank_sim.h"

msim_status msim_sim_break(msim_sim *sim, int32_t n, const int32_t *springs, msim_error *err) {
  if (!sim || (n > 0 && !springs)) return ms_error_set(err, MSIM_ERR_ARG, "sim or springs is NULL");
  const msim_status refused = ms_rank_sim_refuse(sim, "msim_sim_break", err);
  if (refused) return refused;
  const msim_status status = ms_scene_check_count(n, "springs", err);
  if (status) return status;
  if (!sim->scene->broken)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "no law of the scene has break_strain or break_force; add such a law, or "
                        "remove springs by msim_sim_edit");
  for (int32_t i = 0; i < n; i++)
    if (springs[i] < 0 || springs[i] >= sim->scene->nsprings)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "springs[%d] is %d; there are %d springs, counted from 0", i, springs[i],
                          sim->scene->nsprings);
  if (n) ms_breaking_break(sim, n, springs);
  return ms_error_clear(err);
}
