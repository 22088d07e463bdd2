// A plate with a hole that is surrounded by thin layers of triangles. The mesh is so coarse that the edges of the hole cut
// through the first layers when they are curved.
SetFactory("OpenCASCADE");
Rectangle(1) = {-4, -4, 0, 8, 8};
Disk(2) = {0, 0, 0, 1};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
hole() = CombinedBoundary{ Surface{3}; };
MeshSize{ PointsOf{ Surface{3}; } } = 2.5;
hole = hole(#hole() - 1);
Field[1] = BoundaryLayer;
Field[1].CurvesList = {hole};
Field[1].Size = 0.04;
Field[1].Ratio = 1.6;
Field[1].Thickness = 0.4;
BoundaryLayer Field = 1;
Transfinite Curve {hole} = 13;
Physical Surface("plate") = {3};
Physical Curve("hole") = {hole};
