        if (!elbow(meeting, v, s2, s3)) continue;
        for (j = 0; j < 2; j++) {
            double L[3][3], M[3][3], h6[3], h4[3], s5[2];
            columns_turned(1, -s2[j], G, L);
            columns_turned(2, -s3[j], L, M); /* what the wrist has to turn */
            for (a = 0; a < 3; a++) h6[a] = M[0][a] * H[5][0] + M[1][a] * H[5][1] + M[2][a] * H[5][2], h4[a] = dot(M[a], H[3]);
            both_angles(H[3], H[4], H[5], dot(H[3], h6), s5);
            if (fabs(sin(s5[0])) < NEAR) *near = 1;
            for (k = 0; k < 2; k++) {
                double s[6], from[3], to[3];
                turned(H[4], s5[k], H[5], from);
                turned(H[4], -s5[k], H[3], to);
                s[0] = s1[i], s[1] = s2[j], s[2] = s3[j], s[4] = s5[k];
                s[3] = angle_between(H[3], from, h6);
                s[5] = angle_between(H[5], h4, to);
                into_joints(s, starts[n++]);
            }
        }
