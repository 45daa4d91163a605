#include "surf_collide_table.h"

#include <cmath>
#include <cstring>

#include "comm.h"
#include "error.h"
#include "input.h"
#include "math_const.h"
#include "math_extra.h"
#include "random_knuth.h"
#include "random_mars.h"
#include "update.h"

using namespace SPARTA_NS;

SurfCollideTable::SurfCollideTable(SPARTA* sparta, int narg, char** arg) : SurfCollide(sparta, narg, arg), axis() {
    allowreact = 0;
    fixed = narg == 7 && !std::strcmp(arg[3], "axis");
    if (!fixed && (narg != 4 || std::strcmp(arg[3], "random")))
        error->all(FLERR, "surf_collide table: expected FILE random, or FILE axis X Y Z");
    for (int k = 0; fixed && k < 3; k++) axis[k] = input->numeric(FLERR, arg[k + 4]);
    try {
        law = new asperity::Table(arg[2]);
    } catch (const std::exception& problem) {
        error->all(FLERR, problem.what());
    }
    random = new RanKnuth(update->ranmaster->uniform());
    random->reset(update->ranmaster->uniform(), comm->me, 100);
}

SurfCollideTable::~SurfCollideTable() {
    if (copy) return;
    delete random;
    delete law;
}

// Reflects the velocity in the axes ahead, left and the outward normal, which are right-handed.
Particle::OnePart* SurfCollideTable::collide(Particle::OnePart*& particle, double&, int, double* normal, int,
                                             int& reaction) {
    nsingle++;
    reaction = 0;
    double ahead[3], left[3], *v = particle->v;
    // any direction does if those of the grooves are random
    const double any[3] = {std::fabs(normal[0]) < 0.7 ? 1.0 : 0.0, std::fabs(normal[0]) < 0.7 ? 0.0 : 1.0, 0.0};
    const double* given = fixed ? axis : any;
    const double up = MathExtra::dot3(given, normal);
    for (int k = 0; k < 3; k++) ahead[k] = given[k] - up * normal[k];
    if (!(MathExtra::len3(ahead) > 1e-6 * std::fabs(up)))
        error->one(FLERR, "surf_collide table: expected an axis that is not normal to the surface");
    MathExtra::norm3(ahead);
    MathExtra::cross3(normal, ahead, left);
    double w[3] = {MathExtra::dot3(v, ahead), MathExtra::dot3(v, left), MathExtra::dot3(v, normal)};
    const double phi = fixed ? 0.0 : MathConst::MY_2PI * random->uniform(), first = random->uniform();
    try {
        law->reflect(w, phi, first, random->uniform());
    } catch (const std::exception& problem) {
        error->one(FLERR, problem.what());
    }
    for (int k = 0; k < 3; k++) v[k] = w[0] * ahead[k] + w[1] * left[k] + w[2] * normal[k];
    return NULL;
}
