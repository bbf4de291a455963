/* islands - the islands of a scene and their energies (msim_sim_islands) */
#include "base/sized.h"
#include "layout/components.h"
#include "physics/energy.h"
#include "sim/sim.h"

static msim_islands make_islands(const ms_scene *scene, const msim_state *now, int32_t *of,
                                 int32_t n, double *energies) {
  const ms_energies each = {energies, energies + n, energies + 2 * (size_t)n};
  ms_energy_add_parts(scene, now->x, now->v, of, &each);
  return (msim_islands){.n = n,
                        .of = of,
                        .kinetic = each.kinetic,
                        .elastic = each.elastic,
                        .gravitational = each.gravitational};
}

/* The pinned particles are the last island. */
static int32_t number_islands(const ms_scene *scene, int32_t *of) {
  const int32_t n = ms_components_number_particles(scene, of);
  int32_t npinned = 0;
  for (int32_t p = 0; p < scene->nparticles; p++)
    if (of[p] < 0) of[p] = n, npinned++;
  return n + (npinned > 0);
}

msim_status msim_sim_islands(msim_sim *sim, msim_islands *islands) {
  msim_state now = {.size = sizeof now};
  int32_t *of;
  double *energies = NULL;
  if (!sim || !islands) return MSIM_ERR_ARG;
  const msim_status status = msim_sim_state(sim, &now);
  if (status) return status;
  int fits = MS_NEW(&sim->alloc, of, now.n) != NULL;
  const int32_t n = fits ? number_islands(sim->scene, of) : 0;
  fits = fits && MS_NEW(&sim->alloc, energies, 3 * (size_t)n);
  if (!fits) {
    MS_FREE(&sim->alloc, of, energies);
    return MSIM_ERR_MEMORY;
  }
  const msim_islands full = make_islands(sim->scene, &now, of, n, energies);
  MS_FREE(&sim->alloc, sim->island_of, sim->island_energies);
  sim->island_of = of, sim->island_energies = energies;
  return ms_sized_write(islands, &full, sizeof full);
}
