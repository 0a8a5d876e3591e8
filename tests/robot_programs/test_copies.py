"""Routines that move the robot, called twice: each call gets a copy of its own, whatever it is part of."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.krl.read import read_krl
from robot_programs.rapid.read import read_rapid
from robot_programs.urscript.read import read_urscript

KRL = """DEF MAIN( )
DECL REAL X
$TOOL={X 0,Y 0,Z 0,A 0,B 0,C 0}
$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}
X=GO(1.0)
X=GO(2.0)
SUB( )
SUB( )
END
DEF SUB( )
LIN {X 10,Y 0,Z 0,A 0,B 0,C 0}
END
DEFFCT REAL GO(N:IN)
REAL N
LIN {X 10,Y 20,Z 0,A 0,B 0,C 0}
RETURN N
ENDFCT
"""

RAPID = """MODULE M
PERS tooldata t:=[TRUE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PROC main()
 VAR num x;
 x:=go(1);
 IF 1+go(2)>2 x:=1;
 sub;
 sub;
ENDPROC
PROC sub()
 MoveL [[100,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,t;
ENDPROC
FUNC num go(num n)
 MoveL [[100,50,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,t;
 RETURN n;
ENDFUNC
ENDMODULE
"""

URSCRIPT = """def prog():
  def go():
    movel(p[0.1,0.2,0.3,0,0,0])
    return 1
  end
  def sub():
    movel(p[0.1,0.2,0.4,0,0,0])
  end
  x = go()
  x = 1 + go()
  sub()
  sub()
end
"""

READ = {
    "a.src": (KRL, read_krl),
    "a.mod": (RAPID, read_rapid),
    "a.script": (URSCRIPT, lambda sources: read_urscript(sources, tool=Frame(name="t", T=np.eye(4)))),
}


@pytest.mark.parametrize("name", READ)
def test_each_call_gets_a_copy(name):
    text, read = READ[name]
    program = read([Source.of(Path(name), text.encode())])
    assert len(program.motions) == 2
    sources = program.written_out({0, 1})
    assert sources is not None
    again = read(sources)
    assert not any(said.unread for said in again.diagnostics)
    ends = [tuple(np.round(motion.end.T[:3, 3], 6)) for motion in again.motions]
    assert sorted(ends) == sorted(2 * [tuple(np.round(motion.end.T[:3, 3], 6)) for motion in program.motions])
    assert read(sources).written_out({0, 1, 2, 3}) is None
