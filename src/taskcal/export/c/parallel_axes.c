        {
            double h6[3], h2[3], s5[2];
            int m, turns;
            for (a = 0; a < 3; a++) h6[a] = G[0][a] * H[5][0] + G[1][a] * H[5][1] + G[2][a] * H[5][2], h2[a] = dot(G[a], H[1]);
            if (!both_angles(H[1], H[4], H[5], dot(H[1], h6), s5)) continue;
            for (m = 0; m < 2 * 8; m++) {
                double s[6], to[3], x[3], y[3], p4[3], across[3], before[3], all;
                j = m % 2, turns = fabs(sin(s5[j])) < NEAR ? 8 : 1;
                if (m / 2 >= turns) continue;
                if (turns > 1) *near = 1; /* then the last axis may stand anywhere */
                turned(H[4], -s5[j], H[1], to);
                s[0] = s1[i], s[4] = s5[j], s[5] = angle_between(H[5], h2, to) + TWO_PI / 8 * (m / 2);
                /* axes 2 to 4 turn by the rest: from a vector across them, before and behind */
                x[0] = fabs(H[1][0]) < 0.9, x[1] = 1.0 - x[0], x[2] = 0.0;
                cross(H[1], x, across);
                turned(H[4], -s[4], across, x);
                turned(H[5], -s[5], x, y);
                for (a = 0; a < 3; a++) before[a] = G[0][a] * y[0] + G[1][a] * y[1] + G[2][a] * y[2];
                all = angle_between(H[1], across, before);
                /* where axis 4 comes to, from the meeting point that axes 5 and 6 leave */
                for (a = 0; a < 3; a++) x[a] = P[3][a] - meeting[a];
                turned(H[1], all, x, y);
                for (a = 0; a < 3; a++) p4[a] = v[a] + y[a];
                if (!elbow(P[3], p4, s2, s3)) continue;
                for (k = 0; k < 2; k++) {
                    s[1] = s2[k], s[2] = s3[k];
                    s[3] = dot(H[3], H[1]) * (all - s2[k] - dot(H[2], H[1]) * s3[k]);
                    into_joints(s, starts[n++]);
                }
            }
        }
