#include "base/suggest.h"

#include <ctype.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>

/*------------------------------------- words of other systems -----------------------------------*/

/* What SciPy, MATLAB, SUNDIALS, PETSc, physics engines and textbooks call things of msim. These
 * words are suggestions, not aliases: each thing has one name in scripts and scene files. A word
 * may stand for several names, of which the list that is searched has one. */
static const struct {
  const char *word, *name;
} others[] = {
    /* integrators */
    {"euler", "explicit-euler"},
    {"forward-euler", "explicit-euler"},
    {"backward-euler", "implicit-euler"},
    {"semi-implicit-euler", "symplectic-euler"},
    {"semi-implicit", "symplectic-euler"},
    {"euler-cromer", "symplectic-euler"},
    {"linearized-implicit-euler", "linearly-implicit-euler"},
    {"baraff-witkin", "linearly-implicit-euler"},
    {"leapfrog", "velocity-verlet"},
    {"stormer-verlet", "velocity-verlet"},
    {"stoermer-verlet", "velocity-verlet"},
    {"vv", "velocity-verlet"},
    {"rk2", "heun"},
    {"improved-euler", "heun"},
    {"runge-kutta", "rk4"},
    {"rk23", "dop853"},
    {"rk45", "dop853"},
    {"rkf45", "dop853"},
    {"ode45", "dop853"},
    {"dopri5", "dop853"},
    {"dormand-prince", "dop853"},
    {"adaptive", "dop853"},
    {"multirate", "respa"},
    {"mts", "respa"},
    {"crank-nicolson", "trapezoidal"},
    {"newmark-beta", "newmark"},
    {"midpoint", "implicit-midpoint"},
    {"bdf1", "implicit-euler"},
    {"bdf", "bdf2"},
    {"gear", "bdf2"},
    {"cvode", "bdf2"},
    {"ode15s", "bdf2"},
    {"ode23t", "trapezoidal"},
    {"ode23tb", "tr-bdf2"},
    {"lsoda", "auto"},
    /* solvers */
    {"cg", "pcg"},
    {"conjugate-gradient", "pcg"},
    {"iterative", "pcg"},
    {"llt", "cholmod"},
    {"ldlt", "cholmod"},
    {"cholesky", "cholmod"},
    {"suitesparse", "cholmod"},
    {"direct", "cholmod"},
    {"lu", "klu"},
    {"sparselu", "klu"},
    {"superlu", "klu"},
    {"umfpack", "klu"},
    {"gmres", "sundials-spgmr"},
    {"fgmres", "sundials-spfgmr"},
    {"bicgstab", "sundials-spbcgs"},
    {"tfqmr", "sundials-sptfqmr"},
    /* options */
    {"method", "integrator"},
    {"scheme", "integrator"},
    {"stepper", "integrator"},
    {"dt", "h"},
    {"delta-t", "h"},
    {"step-size", "h"},
    {"timestep", "h"},
    {"time-step", "h"},
    {"duration", "t_end"},
    {"time", "t_end"},
    {"end", "t_end"},
    {"end-time", "t_end"},
    {"stop-time", "t_end"},
    {"final-time", "t_end"},
    {"t-final", "t_end"},
    {"t-max", "t_end"},
    {"max-time", "t_end"},
    {"nsteps", "steps"},
    {"num-steps", "steps"},
    {"rtol", "tol"},
    {"atol", "tol"},
    {"reltol", "tol"},
    {"abstol", "tol"},
    {"tolerance", "tol"},
    {"linear-solver", "solver"},
    {"maxiter", "solver.max_iterations"},
    {"max-iterations", "solver.max_iterations"},
    {"num-threads", "threads"},
    {"jobs", "threads"},
    {"stride", "every"},
    {"save-every", "every"},
    {"output-every", "every"},
    {"frame-rate", "fps"},
    {"rate", "fps"},
    /* arguments of msim_cli */
    {"output", "out"},
    {"trajectory", "out"},
    {"overwrite", "force"},
    {"continue", "resume"},
    {"restart", "resume"},
    {"initial", "init"},
    {"verbose", "stats"},
    {"statistics", "stats"},
    {"profile", "stats"},
    {"silent", "quiet"},
    {"simulate", "run"},
    {"start", "run"},
    {"plan", "explain"},
    {"info", "explain"},
    {"dry-run", "explain"},
    {"solvers", "list"},
    {"integrators", "list"},
    {"plugins", "list"},
    /* keys and types of scene files */
    {"g", "gravity"},
    {"viscosity", "drag"},
    {"air-drag", "drag"},
    {"nodes", "particles"},
    {"points", "particles"},
    {"vertices", "particles"},
    {"masses", "particles"},
    {"position", "x"},
    {"positions", "x"},
    {"pos", "x"},
    {"velocity", "v"},
    {"velocities", "v"},
    {"vel", "v"},
    {"m", "mass"},
    {"fixed", "pinned"},
    {"anchored", "pinned"},
    {"static", "pinned"},
    {"edges", "springs"},
    {"edges", "ij"},
    {"pairs", "ij"},
    {"indices", "ij"},
    {"stiffness", "k"},
    {"length", "rest"},
    {"l0", "rest"},
    {"rest-length", "rest"},
    {"c", "damping"},
    {"triangles", "faces"},
    {"walls", "planes"},
    {"ground", "planes"},
    {"floor", "planes"},
    {"obstacles", "colliders"},
    {"solids", "colliders"},
    {"spheres", "colliders"},
    {"boxes", "colliders"},
    {"bounce", "restitution"},
    {"elasticity", "restitution"},
    {"mu", "friction"},
    {"n", "normal"},
    {"options", "run"},
    {"simulation", "run"},
    {"version", "msim"},
    {"title", "name"},
    {"chain", "rope"},
    {"cable", "rope"},
    {"string", "rope"},
    {"sheet", "cloth"},
    {"fabric", "cloth"},
    {"grid", "cloth"},
    {"box", "lattice"},
    {"block", "lattice"},
    {"cube", "lattice"},
    {"jelly", "lattice"},
};
enum { NOTHERS = sizeof others / sizeof *others };

/* 1: equal but for case and the characters between words, as in "TimeStep" and "time_step". */
static int is_same_word(const char *a, const char *b) {
  for (;; a++, b++) {
    a += strspn(a, "-_. ");
    b += strspn(b, "-_. ");
    if (tolower((unsigned char)*a) != tolower((unsigned char)*b)) return 0;
    if (!*a) return 1;
  }
}

/* The word in the list for which other systems say `word`, or which is written in another way. */
static const char *find_other(const char *word, ms_word_list *words, const void *data) {
  const char *name;
  for (int32_t i = 0; (name = words(i, data)) != NULL; i++)
    if (is_same_word(word, name)) return name;
  for (int o = 0; o < NOTHERS; o++)
    for (int32_t i = 0; is_same_word(word, others[o].word) && (name = words(i, data)) != NULL; i++)
      if (strcmp(name, others[o].name) == 0) return name;
  return NULL;
}

/*------------------------------------- similar words --------------------------------------------*/

static int min3(int a, int b, int c) {
  int m = a < b ? a : b;
  return m < c ? m : c;
}

/* Levenshtein distance; INT_MAX for words longer than the table. */
static int edit_distance(const char *a, const char *b) {
  enum { LONGEST = 47 };
  int row[LONGEST + 1];
  int na = (int)strlen(a), nb = (int)strlen(b);
  if (na > LONGEST || nb > LONGEST) return INT_MAX;
  for (int j = 0; j <= nb; j++) row[j] = j;
  for (int i = 1; i <= na; i++) {
    int diagonal = row[0];
    row[0] = i;
    for (int j = 1; j <= nb; j++) {
      int above = row[j];
      row[j] = min3(above + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1]));
      diagonal = above;
    }
  }
  return row[nb];
}

/* One error per three letters, plus one, but not all letters. */
static const char *find_similar(const char *word, ms_word_list *words, const void *data) {
  const size_t length = strlen(word);
  const char *best = NULL, *name;
  int least = (int)length / 3 + 2;
  for (int32_t i = 0; (name = words(i, data)) != NULL; i++) {
    const int begins = length > 1 && strncmp(name, word, length) == 0;
    const int distance = begins ? 0 : edit_distance(word, name);
    if (distance >= least || distance >= (int)length) continue;
    best = name;
    least = distance;
  }
  return best;
}

const char *ms_suggest_word(const char *word, ms_word_list *words, const void *data) {
  const char *other = find_other(word, words, data);
  const char *meant = other ? other : find_similar(word, words, data);
  return meant && strcmp(meant, word) != 0 ? meant : NULL;
}

ms_hint ms_suggest_hint(const char *word, ms_word_list *words, const void *data) {
  const char *meant = ms_suggest_word(word, words, data);
  ms_hint hint = {""};
  if (meant) snprintf(hint.text, sizeof hint.text, " (did you mean '%s'?)", meant);
  return hint;
}

static const char *name_at(int32_t i, const void *names) { return ((const char *const *)names)[i]; }

const char *msim_nearest_name(const char *word, const char *const *names) {
  return word && names ? ms_suggest_word(word, name_at, names) : NULL;
}
