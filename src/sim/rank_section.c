#include "sim/rank_section.h"

#include "physics/energy.h"
#include "sim/rank_others.h"

/*------------------------------------- creation -------------------------------------------------*/

/* What ranks request from each other: 64-bit numbers of particles */
typedef struct requests {
  int64_t *nin, *nout;           /* nranks: particles requested from each rank, and by it */
  int64_t *in_bytes, *out_bytes; /* nranks: scratch */
  int64_t *in, *out;             /* their numbers, by rank */
} requests;

static int32_t count_rows(const ms_rank_section *s) { return s->in_whole.n + s->in_whole.nothers; }

static int list_wanted(const msim_sim *sim, const int32_t *owner, ms_rank_section *s, requests *q) {
  const msim_allocator *alloc = &sim->alloc;
  const size_t n = (size_t)sim->ranks->n;
  const int32_t rows = count_rows(s);
  if (!ms_buckets_create(alloc, rows, owner, sim->ranks->n, &s->in)) return 0;
  const int32_t nin = s->in.first[n];
  if (!MS_NEW(alloc, s->x, 3 * (size_t)rows) || !MS_NEW(alloc, s->v, 3 * (size_t)rows) ||
      !MS_NEW(alloc, s->send_bytes, n) || !MS_NEW(alloc, s->receive_bytes, n) ||
      !MS_NEW(alloc, s->receive, nin) || !MS_NEW(alloc, q->nin, n) || !MS_NEW(alloc, q->nout, n) ||
      !MS_NEW(alloc, q->in_bytes, n) || !MS_NEW(alloc, q->out_bytes, n) ||
      !MS_NEW(alloc, q->in, nin))
    return 0;
  for (int32_t k = 0; k < nin; k++)
    q->in[k] = ms_section_particle(&s->in_whole, (size_t)s->in.item[k]);
  for (size_t r = 0; r < n; r++) {
    q->nin[r] = s->in.first[r + 1] - s->in.first[r];
    q->in_bytes[r] = sizeof *q->nin;
    s->receive_bytes[r] = q->nin[r] * (int64_t)sizeof *s->receive;
  }
  return 1;
}

static int allocate_messages(const msim_sim *sim, ms_rank_section *s, requests *q) {
  for (int32_t r = 0; r < sim->ranks->n; r++) {
    s->nout += (int32_t)q->nout[r];
    q->in_bytes[r] = q->nin[r] * (int64_t)sizeof *q->in;
    q->out_bytes[r] = q->nout[r] * (int64_t)sizeof *q->out;
    s->send_bytes[r] = q->nout[r] * (int64_t)sizeof *s->send;
  }
  return MS_NEW(&sim->alloc, q->out, s->nout) && MS_NEW(&sim->alloc, s->out, s->nout) &&
         MS_NEW(&sim->alloc, s->send, s->nout);
}

/* The scenes of all ranks are the same (ms_rank_sim_compare): they ask for own particles only. */
static int find_unknowns(const msim_sim *sim, ms_rank_section *s, const requests *q) {
  const ms_unknowns *rows = &sim->islands->model.unknowns;
  int32_t *row;
  if (!MS_NEW(&sim->alloc, row, sim->scene->nparticles)) return 0;
  for (int32_t r = 0; r < rows->nfree; r++) row[rows->particle[r]] = r;
  for (int32_t k = 0; k < s->nout; k++)
    s->out[k] = row[ms_rank_scene_find_particle(sim, (int32_t)q->out[k])];
  ms_memory_free(&sim->alloc, row);
  return 1;
}

static msim_status agree(const msim_sim *sim, int fits, msim_error *err) {
  return ms_ranks_agree_on_memory(sim->ranks, fits, "the rows of a frame", err);
}

/* What is not in the section, and the owner of each row */
static msim_status find_rows(msim_sim *sim, ms_rank_section *s, int32_t **owner, msim_error *err) {
  ms_rank_others others;
  s->in_whole = sim->kept ? sim->kept->in_whole
                          : ms_section_of_rank(sim->scene, sim->ranks->rank, sim->ranks->n);
  msim_status status = ms_rank_others_find(sim, &s->in_whole, &others, err);
  s->in_whole.other = s->other = others.particle, s->in_whole.nothers = others.n;
  s->in_whole.other_spring = s->other_spring = others.spring,
  s->in_whole.nother_springs = others.nsprings;
  if (!status) status = agree(sim, MS_NEW(&sim->alloc, *owner, count_rows(s)) != NULL, err);
  return status ? status : ms_rank_scene_find_owners(sim, &s->in_whole, *owner, err);
}

static msim_status connect(msim_sim *sim, ms_rank_section *s, requests *q, msim_error *err) {
  ms_ranks *ranks = sim->ranks;
  int32_t *owner = NULL;
  msim_status status = agree(sim, s != NULL, err);
  if (!status) status = find_rows(sim, s, &owner, err);
  if (!status) status = agree(sim, list_wanted(sim, owner, s, q), err);
  ms_memory_free(&sim->alloc, owner);
  if (status) return status;
  ms_ranks_all_to_all(ranks, q->in_bytes, q->nin, q->in_bytes, q->nout);
  status = agree(sim, ranks->failed || allocate_messages(sim, s, q), err);
  if (status) return status;
  ms_ranks_all_to_all(ranks, q->in_bytes, q->in, q->out_bytes, q->out);
  return agree(sim, ranks->failed || find_unknowns(sim, s, q), err);
}

msim_status ms_rank_section_create(msim_sim *sim, msim_error *err) {
  requests q = {0};
  if (sim->section) return MSIM_OK;
  msim_status status = connect(sim, MS_NEW(&sim->alloc, sim->section, 1), &q, err);
  MS_FREE(&sim->alloc, q.nin, q.nout, q.in_bytes, q.out_bytes, q.in, q.out);
  if (!status) status = ms_rank_scene_extend(sim, &sim->section->in_whole, err);
  if (status) ms_rank_section_destroy(sim);
  else ms_rank_section_copy(sim, ms_rank_section_scene(sim)->x, ms_rank_section_scene(sim)->v);
  ms_rank_scene_trim(sim);
  return status;
}

void ms_rank_section_destroy(msim_sim *sim) {
  ms_rank_section *s = sim->section;
  if (!s) return;
  ms_buckets_destroy(&sim->alloc, &s->in);
  MS_FREE(&sim->alloc, s->x, s->v, s->other, s->other_spring, s->out, s->send_bytes,
          s->receive_bytes, s->send, s->receive, s);
  sim->section = NULL;
}

/*------------------------------------- use ------------------------------------------------------*/

void ms_rank_section_copy(const msim_sim *sim, const double *x, const double *v) {
  const ms_rank_section *s = sim->section;
  const ms_section is = ms_rank_section_numbers(sim);
  for (size_t i = 0; i < (size_t)count_rows(s); i++) {
    const size_t p = 3 * (size_t)ms_section_particle(&is, i);
    for (size_t c = 0; c < 3; c++) s->x[3 * i + c] = x[p + c], s->v[3 * i + c] = v[p + c];
  }
}

static void exchange_vector(const msim_sim *sim, const double *vec, double *rows) {
  const ms_unknowns *of = &sim->islands->model.unknowns;
  const ms_rank_section *s = sim->section;
  for (int32_t c = 0; c < of->dims; c++) {
    for (int32_t k = 0; k < s->nout; k++)
      s->send[k] = vec[(size_t)c * (size_t)of->stride + (size_t)s->out[k]];
    ms_ranks_all_to_all(sim->ranks, s->send_bytes, s->send, s->receive_bytes, s->receive);
    for (int32_t k = 0; k < s->in.first[sim->ranks->n]; k++)
      rows[3 * (size_t)s->in.item[k] + (size_t)of->axis[c]] = s->receive[k];
  }
}

void ms_rank_section_exchange(const msim_sim *sim, const double *x, const double *v) {
  exchange_vector(sim, x, sim->section->x);
  exchange_vector(sim, v, sim->section->v);
}

/* The sums pass from rank to rank. */
msim_energy ms_rank_section_sum_energy(const msim_sim *sim) {
  const ms_rank_section *s = sim->section;
  const ms_section is = ms_rank_section_numbers(sim);
  msim_energy sum = {0};
  for (int round = 0; round < MS_ENERGY_ROUNDS; round++)
    for (int32_t r = 0; r < sim->ranks->n; r++) {
      if (r == sim->ranks->rank)
        ms_energy_add_section(ms_rank_section_scene(sim), &is, s->x, s->v, round, &sum);
      ms_ranks_broadcast(sim->ranks, r, sizeof sum, &sum);
    }
  ms_energy_set_total(&sum);
  return sum;
}
