"""F(q, v, a; δq) = 0 of a problem: tangents M, C, K, affine pieces, the hub angle as one more unknown."""
