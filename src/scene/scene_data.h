/* scene_data - creates and destroys the data of a scene, and copies all or some of it */
#ifndef MS_SCENE_DATA_H
#define MS_SCENE_DATA_H

#include "scene/scene.h"

/* A scene without particles, with one reference; NULL: out of memory. */
ms_scene *ms_scene_data_create(const msim_allocator *alloc);

/* A copy of all but `source`; NULL: out of memory. */
ms_scene *ms_scene_data_copy(const ms_scene *scene, msim_error *err);

/* A scene with the name, planes, colliders at their motions, external forces and options of
 * another one, and with arrays for so many particles, springs and faces, which the caller fills;
 * NULL: out of memory. */
ms_scene *ms_scene_data_create_like(const ms_scene *scene, int32_t nparticles, int32_t nsprings,
                                    int32_t nfaces, msim_error *err);

/* What a cut takes of a scene without laws, angular springs, motions and a force function: these
 * particles and springs, in this order, and some of the faces */
typedef struct ms_scene_cut {
  int32_t nparticles, nsprings;
  const int32_t *particle, *spring;
  int32_t first_face, nfaces;
  const int32_t *place; /* for each particle of the scene, its number in the cut; NULL: springs and
                           faces refer to particles by their numbers in the scene */
} ms_scene_cut;

/* The cut, with the planes, colliders, external forces and options of the scene; NULL: out of
 * memory. */
ms_scene *ms_scene_data_cut(const ms_scene *scene, const ms_scene_cut *cut, msim_error *err);

#endif
