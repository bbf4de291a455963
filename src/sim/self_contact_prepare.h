/* self_contact_prepare - refuses what self-contact does not support, and keeps the scene one
 * island */
#ifndef MS_SELF_CONTACT_PREPARE_H
#define MS_SELF_CONTACT_PREPARE_H

#include "sim/sim.h"

/* MSIM_ERR_UNSUPPORTED where an option or a method excludes self-contact. Else, where the scene has
 * it, no particles are left out of steps: contact couples all of them, moves them out of planes and
 * wakes those at rest. */
msim_status ms_self_contact_prepare(msim_sim *sim, msim_error *err);

#endif
