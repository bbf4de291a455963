#include "amplification.h"

#include <math.h>

/*------------------------------------- Runge and Kutta ------------------------------------------*/

/* to = (shift + z L) y,  L = (0, 1; -1, -2 zeta) */
static void apply_oscillator(double zeta, double shift, double z, const double y[2], double to[2]) {
  const double x = y[0], v = y[1];
  to[0] = shift * x + z * v;
  to[1] = shift * v - z * (x + 2 * zeta * v);
}

/* y = sum_k r_k L^k y, k = 0 ... n, L = z (0, 1; -1, -2 zeta): r_k = 1/k! up to the order of the
 * method, the others in `rest` */
static void apply_polynomial(double zeta, double z, int order, int n, const double rest[],
                             double y[2]) {
  const double start[2] = {y[0], y[1]};
  for (int c = 0; c < 2; c++) y[c] *= rest[n - order - 1];
  for (int k = n - 1; k >= 0; k--) {
    const double r = k > order ? rest[k - order - 1] : 1 / tgamma(k + 1);
    apply_oscillator(zeta, 0, z, y, y);
    for (int c = 0; c < 2; c++) y[c] += r * start[c];
  }
}

/* r_k = b A^(k-1) 1, k = 9 ... 12, of the tableau in Hairer, Norsett and Wanner, Solving Ordinary
 * Differential Equations I, II.5 */
void amplify_dop853(double zeta, double z, double y[2]) {
  static const double rest[4] = {2.6916922001690856e-06, 2.34134510820978e-07,
                                 1.4947364854591547e-08, 3.613324578128244e-10};
  apply_polynomial(zeta, z, 8, 12, rest, y);
}

const double amplification_rk6_terms[5] = {0.000197172944079033037, 0.0000227630629217447379,
                                           1.89490634584398076e-6, 9.58383779100959055e-8,
                                           2.14187646383576264e-9};

void amplify_rk6(double zeta, double z, double y[2]) {
  apply_polynomial(zeta, z, 6, 11, amplification_rk6_terms, y);
}

/* R(z) = (1 + 9 w^10)/10, w = 1 + z/9 (Kraaijevanger 1991) */
void amplify_ssprk102(double zeta, double z, double y[2]) {
  double now[2] = {y[0], y[1]};
  for (int i = 0; i < 10; i++) apply_oscillator(zeta, 1, z / 9, now, now);
  for (int c = 0; c < 2; c++) y[c] = 0.1 * y[c] + 0.9 * now[c];
}

/* R(z) = (1 + 18 w^5 + 6 w^10)/25, w = 1 + z/6 (Ketcheson 2008) */
void amplify_ssprk104(double zeta, double z, double y[2]) {
  static const double weight[3] = {1. / 25, 18. / 25, 6. / 25};
  double now[2] = {y[0], y[1]};
  for (int c = 0; c < 2; c++) y[c] *= weight[0];
  for (int part = 1; part < 3; part++) {
    for (int i = 0; i < 5; i++) apply_oscillator(zeta, 1, z / 6, now, now);
    for (int c = 0; c < 2; c++) y[c] += weight[part] * now[c];
  }
}

/* R(z) = 1 - b T_s(w0) + b T_s(w0 + w1 z),  w0 = 1 + (2/13)/s^2,  w1 = T_s'/T_s'', b = T_s''/T_s'^2
 * at w0 = cosh u, where T_s = cosh s u. The number of stages s is the one that the authors choose
 * for eigenvalues of modulus w max(2 zeta, 1): s^2 >= 1 + z max(2 zeta, 1)/0.653 (Sommeijer,
 * Shampine and Verwer 1998) */
void amplify_rkc(double zeta, double z, double y[2]) {
  const double s = fmax(2, ceil(sqrt(1 + z * fmax(2 * zeta, 1) / 0.653)));
  const double w0 = 1 + 2 / (13 * s * s), u = acosh(w0);
  const double T = cosh(s * u), T1 = s * sinh(s * u) / sinh(u);
  const double T2 = (s * s * T - w0 * T1) / (w0 * w0 - 1);
  const double w1 = T1 / T2, b = T2 / (T1 * T1);
  double before[2] = {y[0], y[1]}, now[2], next[2];
  apply_oscillator(zeta, w0, w1 * z, before, now);
  for (int j = 2; j <= (int)s; j++) {
    apply_oscillator(zeta, w0, w1 * z, now, next);
    for (int c = 0; c < 2; c++)
      next[c] = 2 * next[c] - before[c], before[c] = now[c], now[c] = next[c];
  }
  for (int c = 0; c < 2; c++) y[c] = (1 - b * T) * y[c] + b * now[c];
}

/*------------------------------------- kicks and drifts -----------------------------------------*/

/* Leapfrog with the acceleration a(x + h^2/12 a(x)) (Takahashi and Imada 1984; Wisdom, Holman and
 * Touma 1996) */
void amplify_takahashi_imada(double zeta, double z, double y[2]) {
  (void)zeta;
  y[1] -= z * (1 - z * z / 12) * y[0];
  y[0] += z * y[1];
}

/* A composition of the form of Omelyan, Mryglod and Folk (Phys. Rev. E 66 (2002) 026701), with the
 * four coefficients that give order 6 on an oscillator. They are unpublished:
 * tests/test_amplification.c solves the four order conditions and compares. */
void amplify_force_gradient(double zeta, double z, double y[2]) {
  static const double a = 0.24004250742648506, b[2] = {0.0891007659901135, 0.28694996084206753},
                      g = 0.023037733119604515;
  const double drift[4] = {a, 0.5 - a, 0.5 - a, a};
  const double kick[5] = {b[0], b[1], (1 - 2 * (b[0] + b[1])) * (1 - g * z * z), b[1], b[0]};
  (void)zeta;
  for (int i = 0; i < 4; i++) y[1] -= z * kick[i] * y[0], y[0] += z * drift[i] * y[1];
  y[1] -= z * kick[4] * y[0];
}

/* SRKN_11^6 of Blanes and Moan (2002), table 3: half of a symmetric method whose kicks and drifts
 * sum to 1 */
void amplify_rkn6(double zeta, double z, double y[2]) {
  static const double b[5] = {0.0414649985182624, 0.198128671918067, -0.0400061921041533,
                              0.0752539843015807, -0.0115113874206879};
  static const double a[5] = {0.123229775946271, 0.290553797799558, -0.127049212625417,
                              -0.246331761062075, 0.357208872795928};
  double kick = 0.5, drift = 1;
  (void)zeta;
  for (int i = 0; i < 5; i++) {
    y[1] -= z * b[i] * y[0], y[0] += z * a[i] * y[1];
    kick -= b[i], drift -= 2 * a[i];
  }
  y[1] -= z * kick * y[0], y[0] += z * drift * y[1], y[1] -= z * kick * y[0];
  for (int i = 4; i >= 0; i--) y[0] += z * a[i] * y[1], y[1] -= z * b[i] * y[0];
}

static void leapfrog_step(double z, double k, double y[2]) {
  y[1] -= z / 2 * k * y[0], y[0] += z * y[1], y[1] -= z / 2 * k * y[0];
}

/* Half kicks of the soft spring around n steps with the stiff one (Tuckerman, Berne and Martyna
 * 1992): unstable near h w = pi. n follows the library's rule, in which Gershgorin's discs bound
 * squared frequencies by 2 k/m: up to h^2 (2 + 2 soft) = 4 all springs take the same step; beyond,
 * n is the smallest with h sqrt(2)/n <= 1, half the stability limit of leapfrog. */
void amplify_respa(double zeta, double z, double y[2]) {
  const double soft = SOFT_STIFFNESS;
  const int n = (int)ceil(sqrt(2) * z);
  (void)zeta;
  if (z * z * (1 + soft) < 2) {
    leapfrog_step(z, 1 + soft, y);
    return;
  }
  y[1] -= z / 2 * soft * y[0];
  for (int i = 0; i < n; i++) leapfrog_step(z / n, 1, y);
  y[1] -= z / 2 * soft * y[0];
}

/*------------------------------------- growth ---------------------------------------------------*/

double amplification_rate(amplification_step *step, double zeta, double z) {
  double p[2] = {1, 0}, q[2] = {0, 1};
  step(zeta, z, p);
  step(zeta, z, q);
  const double half = (p[0] + q[1]) / 2, det = p[0] * q[1] - p[1] * q[0];
  const double split = half * half - det;
  return split < 0 ? 0.5 * log(det) : log(fabs(half) + sqrt(split));
}
