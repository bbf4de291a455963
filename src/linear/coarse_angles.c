#include "linear/coarse_angles.h"

#include "physics/angle_springs.h"

int32_t *ms_coarse_angles_list_links(const ms_model *model, const ms_aggregates *g, int32_t k,
                                     int32_t *mark, int32_t *next) {
  const ms_angles *angles = &model->angles;
  for (int32_t i = g->first[k]; i < g->first[k + 1] && angles->n; i++) {
    const int32_t row = g->unknown[i];
    for (int32_t at = angles->of.first[row]; at < angles->of.first[row + 1]; at++)
      for (int c = 0; c < 3; c++) {
        const int32_t e = angles->of.item[at] / 3;
        const int32_t other = ms_aggregates_find(model, g, angles->row[3 * e + c]);
        if (other >= 0 && mark[other] != k) mark[other] = k, *next++ = other;
      }
  }
  return next;
}

/* by columns: to += by w_r (x) block w_c, w the modes at both rows */
static void add_block(size_t dims, double by, double block[3][3], const float *row_modes,
                      const float *column_modes, double *to) {
  const size_t size = MS_MODES * dims;
  for (size_t d = 0; d < dims; d++)
    for (size_t n = 0; n < MS_MODES; n++)
      for (size_t c = 0; c < dims; c++)
        for (size_t m = 0; m < MS_MODES; m++)
          to[(MS_MODES * d + n) * size + MS_MODES * c + m] +=
              by * (double)row_modes[m] * block[c][d] * (double)column_modes[n];
}

static void assemble_corner(ms_coarse *coarse, const ms_coarse_matrix *a, int32_t corner) {
  const ms_model *model = coarse->model;
  const ms_aggregates *g = &coarse->aggregates;
  const int32_t *rows = model->angles.row + 3 * (corner / 3), row = rows[corner % 3];
  const int32_t own = g->of[row], *position = coarse->position;
  const size_t size = MS_MODES * (size_t)model->unknowns.dims, area = size * size;
  double element[MS_ANGLE_ELEMENT], block[3][3];
  ms_angle_springs_get_element(a->a, corner / 3, element);
  for (int c = 0; c < 3; c++) {
    const int32_t other = ms_aggregates_find(model, g, rows[c]);
    if (other < 0 || position[own] < position[other]) continue;
    const int32_t at = other == own ? coarse->diagonal[own] : ms_coarse_find(coarse, own, other);
    ms_angle_block(element, corner % 3, c, block);
    add_block((size_t)model->unknowns.dims, a->by, block, g->weight + MS_MODES * row,
              g->weight + MS_MODES * rows[c], coarse->value + area * (size_t)at);
  }
}

void ms_coarse_angles_assemble(ms_coarse *coarse, const ms_coarse_matrix *a, int32_t aggregate) {
  const ms_angles *angles = &coarse->model->angles;
  const ms_aggregates *g = &coarse->aggregates;
  for (int32_t i = g->first[aggregate]; i < g->first[aggregate + 1] && angles->n; i++)
    for (int32_t at = angles->of.first[g->unknown[i]]; at < angles->of.first[g->unknown[i] + 1];
         at++)
      assemble_corner(coarse, a, angles->of.item[at]);
}
