/* contact_surface - what touches in self-contact: the faces of a scene and the springs of ropes, as
 * elements that share nodes and edges */
#ifndef MS_CONTACT_SURFACE_H
#define MS_CONTACT_SURFACE_H

#include "physics/model.h"

/* Elements are the faces, and the springs in no face with an end that is in no face and has at most
 * two springs. Each node and each edge belongs to the first element that has it, so that two
 * elements that may touch name each pair of features once. */
typedef struct ms_contact_surface {
  int32_t nnodes, nelements, nfaces; /* elements from nfaces on are springs */
  int32_t *node;                     /* of each particle of the scene: 1 + its node; 0: none */
  int32_t *row;                      /* nnodes: the unknown of each node; -1: pinned */
  double *inv_mass;                  /* nnodes, 1/kg; 0: pinned */
  double *x_rest;                    /* 3 nnodes: the positions of the scene, m */
  int32_t (*corner)[3];              /* nelements: nodes; of springs the last one is the second */
  int32_t *spring; /* nelements - nfaces: the springs, by their numbers in the scene */
  uint8_t *owns;   /* nelements: bit c: the element owns corner c, bit 3 + c: edge c
                                        from corner c to the next one */
} ms_contact_surface;

/* An element has so many different corners and edges. */
static inline int ms_contact_surface_count_corners(const ms_contact_surface *s, int32_t element) {
  return element < s->nfaces ? 3 : 2;
}
static inline int ms_contact_surface_count_edges(const ms_contact_surface *s, int32_t element) {
  return element < s->nfaces ? 3 : 1;
}

/* On failure the caller destroys what is there. */
msim_status ms_contact_surface_create(const ms_model *model, ms_contact_surface *surface,
                                      msim_error *err);
void ms_contact_surface_destroy(const ms_scene *scene, ms_contact_surface *surface);

#endif
