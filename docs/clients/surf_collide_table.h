// surf_collide ID table FILE random
// surf_collide ID table FILE axis X Y Z
// FILE is the .csv that law.table(...).save of asperity writes. The vector has the direction of the grooves, or of the
// x axis of a surface; only its component in the wall counts. With random, each particle meets another direction.
// The speed and internal energies are kept. Surface reactions are refused.
#ifdef SURF_COLLIDE_CLASS

SurfCollideStyle(table,SurfCollideTable)

#else

#ifndef SPARTA_SURF_COLLIDE_TABLE_H
#define SPARTA_SURF_COLLIDE_TABLE_H

#include "asperity_table.hpp"
#include "surf_collide.h"

namespace SPARTA_NS {

class SurfCollideTable : public SurfCollide {
public:
    SurfCollideTable(class SPARTA*, int, char**);
    ~SurfCollideTable();
    Particle::OnePart* collide(Particle::OnePart*&, double&, int, double*, int, int&);

private:
    class RanKnuth* random;
    asperity::Table* law;
    bool fixed;
    double axis[3];
};

}  // namespace SPARTA_NS

#endif
#endif
